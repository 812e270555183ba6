"""Whose this project's FMUs are; those of others are their authors'."""

AUTHOR = "The quadcosim authors"
LICENSE = "MIT"
