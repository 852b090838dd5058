"""Rows that a measurement keeps while it runs."""

from pathlib import Path

from benchmarks.records import append_row, read_rows


def test_rows_come_back_and_a_line_cut_short_is_taken_out(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    assert read_rows(path) == []
    append_row(path, {"a": 1})
    append_row(path, {"a": 2})
    assert read_rows(path) == [{"a": 1}, {"a": 2}]
    with path.open("a", encoding="utf-8") as file:
        file.write('{"a"')
    assert read_rows(path) == [{"a": 1}, {"a": 2}]
    append_row(path, {"a": 3})
    assert [row["a"] for row in read_rows(path)] == [1, 2, 3]
