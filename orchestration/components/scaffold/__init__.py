"""What `quadcosim new` writes: a folder with a controller, a plant or a filter, its test and its README."""
