"""Controllers made of few behaviors and conditions: their files, pictures and arrays."""
