"""A robot served over a transport: its arms, what they publish in both dialects, and what they obey."""
