"""What the papers could not do."""
