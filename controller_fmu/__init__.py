"""Controllers as FMUs, one folder each; beside the folders are the modules that all controllers share."""
