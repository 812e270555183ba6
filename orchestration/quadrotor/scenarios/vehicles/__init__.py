"""Vehicles as files of parameters, each figure with its source."""
