"""Measurements: campaigns and their files, checks, and frequency responses from time records."""

from cutvib_ss.measurement.campaign import read_campaign, write_campaign
from cutvib_ss.measurement.estimation import estimate
from cutvib_ss.measurement.records import Campaign, History, MachineLike, Record

__all__ = ["read_campaign", "write_campaign", "estimate", "Campaign", "Record", "History", "MachineLike"]
