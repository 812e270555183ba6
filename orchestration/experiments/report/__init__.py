"""Reports: runs, a study or a comparison as one self-contained HTML file that needs no network."""
