"""What the campaign tries: each module here offers a tuple PARTS of `tests.campaign.part.Part`."""
