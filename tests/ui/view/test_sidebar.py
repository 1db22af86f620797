# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture that is started from a menu opens the tab in which its progress is shown."""

from types import SimpleNamespace

from scope.scope_addon.ui.view import sidebar


class Region:
    """A sidebar that knows its tabs only after it has been drawn."""

    type = "UI"

    def __init__(self, drawn):
        self.drawn = drawn
        self.tab = "Item"

    @property
    def active_panel_category(self):
        return self.tab if self.drawn else "UNSUPPORTED"

    @active_panel_category.setter
    def active_panel_category(self, tab):
        if not self.drawn:
            raise AttributeError("read-only")
        self.tab = tab


def area(kind="VIEW_3D", size=(800, 600), drawn=True):
    spaces = SimpleNamespace(active=SimpleNamespace(show_region_ui=False))
    regions = [SimpleNamespace(type="WINDOW"), Region(drawn)]
    found = SimpleNamespace(
        type=kind, width=size[0], height=size[1], spaces=spaces, regions=regions
    )
    found.as_pointer = lambda: id(found)
    found.tag_redraw = lambda: None
    return found


def context(areas, active=None):
    window = SimpleNamespace(screen=SimpleNamespace(areas=areas))
    return SimpleNamespace(window=window, area=active)


def test_the_tab_opens_in_the_largest_viewport_of_a_menu():
    menu = area("TOPBAR", (2000, 2000))
    small = area(size=(100, 100))
    large = area()
    sidebar.show_tab(context([menu, small, large], menu))
    assert [each.spaces.active.show_region_ui for each in (menu, small, large)] == [
        False,
        False,
        True,
    ]
    assert large.regions[1].tab == "Scope"


def test_the_tab_opens_in_the_viewport_that_a_file_is_dropped_in():
    small = area(size=(100, 100))
    large = area()
    sidebar.show_tab(context([small, large], small))
    assert [each.spaces.active.show_region_ui for each in (small, large)] == [True, False]


def test_without_a_viewport_or_before_the_first_drawing_nothing_fails():
    sidebar.show_tab(context([area("TOPBAR")]))
    sidebar.show_tab(SimpleNamespace(window=None, area=None))
    new = area(drawn=False)
    sidebar.show_tab(context([new]))
    assert new.spaces.active.show_region_ui


def test_what_a_menu_at_the_top_imports_is_framed_in_the_largest_viewport():
    menu = area("TOPBAR", (2000, 2000))
    small = area(size=(100, 100))
    large = area()
    assert sidebar.viewport_of(context([menu, small, large], menu)) is large
    assert sidebar.viewport_of(context([menu, small, large], small)) is small
    assert sidebar.viewport_of(context([menu], menu)) is None
