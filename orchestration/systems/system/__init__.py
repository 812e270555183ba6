"""A system as data: components, connections, sources, objectives and a criterion."""
