"""Shared parts of separation methods: checks, gates, statistics, and the resulting layers."""
