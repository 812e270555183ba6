"""Controllers as FMUs, one folder each; beside the folders is what every controller shares."""
