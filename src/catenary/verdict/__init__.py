"""What is wrong with a recording, judged before anything is fitted to it."""
