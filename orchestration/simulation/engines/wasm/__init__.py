"""Systems as WebAssembly: their components, batch.c and the timetable in one module, which a page runs by itself."""
