"""What people write beside their motions: clips.csv."""

from __future__ import annotations

import os

import pytest

from mwlib import load_motions
from mwlib.cli import main
from mwlib.data.untrusted import BrokenFilesWarning, DoubtfulDataWarning, MotionFormatError
from tests.sample_motions import BVH


@pytest.fixture
def folder(tmp_path):
    """Three clips; clips.csv is for the test to write."""
    (tmp_path / "sub").mkdir()
    for name in ("a.bvh", "b.bvh", "sub/c.bvh"):
        (tmp_path / name).write_text(BVH)
    return tmp_path


REFUSED = [
    ("file,FPS\na.bvh,120\n", r"header: found unknown column 'FPS' \(did you mean 'fps'\?\); expected some of file, fps, unit"),
    ("file,frame_rate\na.bvh,120\n", r"unknown column 'frame_rate' \(did you mean 'fps'\?\)"),
    ("file;fps\na.bvh;120\n", r"unknown column 'file;fps', semicolons between columns; commas separate them; expected some of"),
    ("file, units\na.bvh,cm\n", r"unknown column 'units' \(did you mean 'unit'\?\)"),
    ("file,subjct\na.bvh,cm\n", r"unknown column 'subjct' \(did you mean 'subject'\?\)"),
    ("file,zzzzzz\na.bvh,cm\n", r"unknown column 'zzzzzz'; expected some of"),
    ("file;fps\na.bvh;120\n", r"unknown column 'file;fps'"),
    ("file,fps,fps\na.bvh,120,30\n", r"header: found column 'fps' 2 times; expected each once"),
    ("fps\n120\n", r"header: found columns fps; expected a column named file"),
    ("file,fps\na.bvh,120\na.bvh,30\n", r"line 3: found a.bvh, as in line 2; expected one row for each file"),
    ("file,fps\na.bvh,120\n\n./a.bvh.xz,30\n", r"line 4: found ./a.bvh.xz, as in line 2; expected one row for each file"),
    ("file,fps\nsub/c.bvh,120\nsub\\c.bvh,30\n", r"line 3: found sub.c.bvh, as in line 2"),
    ("file,fps\n,120\n", r"line 2: found no file; expected a file in every row"),
    ('file,fps\n"a.bvh,120\nb.bvh,120\n', r"table: found unexpected end of data; expected comma-separated values"),
    ("file,action\na.bvh,jump, forward\n", r"line 2: found 3 cells; expected 2 cells, .*a text with a comma stands in quotes"),
    ("file,subject,action\na.bvh,walk\n", r"line 2: found 2 cells; expected 3 cells, empty ones as well"),
    ("", r"table: found nothing; expected a header with a column named file, and a row for each file"),
    (" ,,\n\n", r"table: found nothing; expected a header"),
    ("file,fps\n,,\n", r"table: found a header without rows; expected a header .*, and a row for each file"),
]


@pytest.mark.parametrize(("table", "message"), REFUSED)
def test_a_table_that_would_not_be_read_whole_is_refused(folder, table, message):
    (folder / "clips.csv").write_text(table)
    with pytest.raises(MotionFormatError, match=message) as refused:
        load_motions(folder)
    assert refused.value.file == str(folder.resolve() / "clips.csv")  # at fault is the table, not the folder
    assert main(["check-data", str(folder)]) == 1


@pytest.mark.parametrize(
    "table",
    [
        "file , fps,subject\n a.bvh , 120 , A\nb.bvh,120, A\nsub/c.bvh,120,A \n",
        '\ufefffile,fps,subject,notes,,\n./a.bvh,120,A,good,,\n\nb.bvh,120,\u00a0A,,,\n,,,,,\nsub//c.bvh,120,"A\t",,,\n',
        "\nfile,fps,subject,trial\na.bvh,120,A,\nb.bvh,120,A,2\nsub\\c.bvh.xz,120,A,1\n",
    ],
)
def test_blanks_change_nothing_and_make_nobody_another_person(folder, table):
    (folder / "clips.csv").write_text(table, encoding="utf-8")
    motions = load_motions(folder)
    assert {m.subject for m in motions} == {"A"} and [m.fps for m in motions] == [120.0] * 3
    assert main(["check-data", str(folder)]) == 0


def test_a_name_of_two_words_keeps_one_blank(folder):
    (folder / "clips.csv").write_text("file,subject\na.bvh,Ann  B\nb.bvh, Ann B\nsub/c.bvh,Ann\u00a0B\n", encoding="utf-8")
    assert {m.subject for m in load_motions(folder)} == {"Ann B"}


def test_what_looks_alike_is_one_person_and_what_nearly_does_is_doubted(folder, capsys):
    table = "file,subject\na.bvh,Rene\u0301\nb.bvh,Ren\u00e9\nsub/c.bvh,Ren\u200b\u00e9\n"
    (folder / "clips.csv").write_text(table, encoding="utf-8")
    assert {m.subject for m in load_motions(folder)} == {"Ren\u00e9"} and main(["check-data", str(folder)]) == 0
    (folder / "clips.csv").write_text("file,subject\na.bvh,Anna 1\nb.bvh,anna_01\nsub/c.bvh,Anna 10\n")
    with pytest.warns(DoubtfulDataWarning, match="several people: 'Anna 1' and 'anna_01'; give one person one name"):
        load_motions(folder)
    capsys.readouterr()
    assert main(["check-data", str(folder)]) == 1 and "'Anna 1' and 'anna_01'" in capsys.readouterr().out


@pytest.mark.parametrize("word", ["1_20", "\u0661\u0662\u0660", "0x78", "120 Hz", "inf"])
def test_a_rate_is_written_in_plain_digits(folder, word):
    (folder / "clips.csv").write_text(f"file,fps\na.bvh,{word}\n", encoding="utf-8")
    with pytest.raises(MotionFormatError, match=r"row of a.bvh, fps: found .*; expected a finite number"):
        load_motions(folder / "a.bvh")


def test_rows_that_match_no_file_are_told(folder, capsys):
    (folder / "clips.csv").write_text("file,fps\nA.bvh,60\nb.bvh,60\nx.bvh,30\nc.bvh,30\n../y.bvh,1\n")
    with pytest.warns(BrokenFilesWarning) as told:
        motions = load_motions(folder)
    assert [m.fps for m in motions] == [120.0, 60.0, 120.0]
    (message,) = [str(warning.message) for warning in told]
    said = "'A.bvh' (did you mean 'a.bvh'?), 'x.bvh', 'c.bvh' (did you mean 'sub/c.bvh'?), '../y.bvh'; expected"
    assert message.startswith(f"{folder.resolve() / 'clips.csv'}: 4 rows match no file: {said}")
    assert message.endswith("; expected paths from the table's folder or one above, at most 3 folders deep")
    assert main(["check-data", str(folder)]) == 1
    assert "4 rows match no file: 'A.bvh'" in capsys.readouterr().out.split("looks wrong:")[1]


def test_rows_may_start_at_a_folder_above_but_one_file_has_one_row(folder):
    (folder / "sub" / "clips.csv").write_text(f"file,fps\n{folder.name}/sub/c.bvh,60\n")
    assert load_motions(folder)[2].fps == 60.0
    (folder / "sub" / "clips.csv").write_text("file,fps\nsub/c.bvh,120\nc.bvh,30\n")
    with pytest.raises(MotionFormatError, match="table: found c.bvh and sub/c.bvh, which are one file; expected one row"):
        load_motions(folder / "sub")


def test_a_row_too_deep_to_be_found_is_told(folder):
    deep = folder / "1" / "2" / "3" / "4"
    deep.mkdir(parents=True)
    (deep / "d.bvh").write_text(BVH)
    (folder / "clips.csv").write_text("file,fps\n1/2/3/4/d.bvh,60\n")
    with pytest.warns(BrokenFilesWarning, match="1 rows match no file: '1/2/3/4/d.bvh'"):
        assert load_motions(folder)[0].fps == 120.0


def test_an_edited_table_is_read_again_even_where_its_time_stays(folder):
    table = folder / "clips.csv"
    table.write_text("file,fps\na.bvh,30.0\n")
    assert load_motions(folder)[0].fps == 30.0
    before = table.stat()
    table.write_text("file,fps\na.bvh,60\n")
    os.utime(table, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert load_motions(folder)[0].fps == 60.0
