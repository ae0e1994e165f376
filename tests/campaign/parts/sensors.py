"""Sensors of gravity that break."""

from tests.campaign.part import Part

PARTS: tuple[Part, ...] = ()
