"""A newcomer: follows the documentation from an empty folder on, word by word, and stops where it does not work."""
