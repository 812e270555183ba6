"""A simulated newcomer, who follows the documentation literally from an empty folder, and stops where it fails."""
