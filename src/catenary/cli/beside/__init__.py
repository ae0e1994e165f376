"""Commands that run beside others until they are ended: a served robot, sensors as topics."""
