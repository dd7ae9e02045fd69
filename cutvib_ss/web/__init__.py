"""The page of `cutvib serve`: a campaign looked at, its model tried out, its diagnosis made and downloaded."""
