"""What was made last is kept as far as there is room."""

from study.support.recent import Recent


def test_what_was_asked_for_longest_ago_makes_room_before_the_next_is_made() -> None:
    kept, there = Recent(room=10), list[int]()

    def made() -> str:
        there.append(kept.size)
        return "made"

    for key, size in (("a", 4), ("b", 4), ("a", 4), ("c", 4), ("a", 4), ("b", 4)):
        assert kept.get(key, size, made) == "made"
    assert there == [0, 4, 4, 4]  # b went for c, which went for b: a was asked for in between
    kept.get("large", 30, made)
    assert there[-1] == 0
    assert kept.size == 30
    kept.get("large", 30, made)
    assert len(there) == 5


def test_no_more_results_are_kept_than_asked() -> None:
    kept, made = Recent(room=10, most=2), list[int]()
    for key in (1, 2, 3, 2, 3, 1):
        kept.get(key, 0, lambda key=key: made.append(key))
    assert made == [1, 2, 3, 1]


def test_what_is_larger_than_asked_is_made_anew() -> None:
    kept, made = Recent(room=10, largest=4), list[int]()
    for size in (5, 4, 5, 4):
        kept.get(size, size, lambda size=size: made.append(size))
    assert made == [5, 4, 5]
    assert kept.size == 4
