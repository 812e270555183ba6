"""What a system is: components, connections, sources, criterion; its file, its paths, its check against FMUs."""
