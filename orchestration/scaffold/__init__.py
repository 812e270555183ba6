"""Working folders for what people write themselves: a controller, a plant, a filter."""
