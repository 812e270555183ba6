"""What both FMUs stand on: algebra, the reference trajectory, the slave base, packaging."""
