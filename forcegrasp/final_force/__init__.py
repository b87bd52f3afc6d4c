"""Tables of final forces: which law they follow, and what may cause it."""
