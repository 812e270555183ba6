"""The geometric tracking controller on SE(3)."""
