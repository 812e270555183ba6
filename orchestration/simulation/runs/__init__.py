"""Runs of requests, their results, and the directories and figures of results."""
