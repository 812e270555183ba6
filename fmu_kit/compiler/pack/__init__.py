"""Into what goes out: compilers of C, archives, the hash of the sources, lanes as a library."""
