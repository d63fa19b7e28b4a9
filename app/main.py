"""Entry of `panel serve app`: one page for each visitor."""

from app.dashboard import page

page().servable()
