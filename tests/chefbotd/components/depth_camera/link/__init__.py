"""Tests of the link to depth cameras."""
