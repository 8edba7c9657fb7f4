"""Parts of the stability benchmark: outcomes, extreme scenes, other programs' results, the map."""
