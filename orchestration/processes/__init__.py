"""Child processes: what they and this one say to each other, how they are limited, and how their end is told."""
