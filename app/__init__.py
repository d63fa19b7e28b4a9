"""The Panel dashboard, served by `panel serve app`."""
