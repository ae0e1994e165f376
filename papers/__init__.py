"""Figures and tables: of the papers, and of recordings of real arms; one file each."""
