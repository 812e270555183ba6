"""One HTML file of runs, a study or a comparison, which needs no network; its scripts are in `page/`."""
