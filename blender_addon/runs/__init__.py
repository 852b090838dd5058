"""Runs of the worker without windows: what is asked for, the steps, the state, the messages."""
