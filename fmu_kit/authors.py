"""The author and the licence of this project's FMUs; FMUs of other projects name their own."""

AUTHOR = "The quadcosim authors"
LICENSE = "MIT"
