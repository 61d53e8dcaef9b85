"""Mutants of fetching."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "data/fetching.py", "data/test_fetching.py",
        ("web-pages-are-data", 'if head.startswith(b"<"):', 'if head.startswith(b"<<"):'),
        ("a-byte-a-second-is-enough", "limit := patience.grace +", "limit := 20 * patience.grace +"),
        ("any-number-of-bytes", "+ len(piece) > self.most:", "+ len(piece) > 100 * self.most:"),
        ("what-came-is-asked-for-again", 'rest = {"Range": f"bytes={done}-"} if done else {}', "rest: dict[str, str] = {}"),
        ("the-rest-is-taken-for-the-whole", "place = done if response.status_code == 206 else 0", "place = 0"),
        ("a-file-longer-than-its-own-stays", "stream.truncate()", "stream.flush()"),
        ("busy-servers-are-asked-once", "_BrokenError if response.status_code in BUSY else NotOfferedError", "NotOfferedError"),
        ("digest-of-the-skeleton-alone", "motion.positions.astype(np.float64)", "0 * motion.positions.astype(np.float64)"),
        ("any-motion-is-the-listed-one", "if found == clip.motion and not others:", "if not others:"),
        ("a-publisher-without-the-data-asked-on", "== MOST_FAULTS:", "== 4 * MOST_FAULTS:"),
        ("clips-without-their-labels", "and _labelled(folder, clips):", "and True:"),
        ("tables-of-others-overwritten", 'if (table := folder / "clips.csv").exists():',
         'if not (table := folder / "clips.csv").parent:'),
        ("there-is-whole", "return all(file_hash(", "return any(file_hash("),
        ("archives-without-a-digest", '"clips.zip", archive.sha256,', '"clips.zip", None,'),
        ("files-without-a-digest", "registry={name: digest}", "registry={name: None}"),
        ("packed-files-are-not-there", '("", *sorted(PACKED))', '("",)'),
        ("no-pause-between-files", "time.sleep(patience.between)", "pass"),
        ("half-clips-in-an-archive", "if len(clips) != archive.count:", "if len(clips) > archive.count:"),
    ),
    *of(
        "data/fetching.py", "data/test_fetching.py::test_a_digest_sees_rate_skeleton_and_every_place",
        ("digest-without-rate", 'f"{motion.fps:g}/{motion.up}/', 'f"{motion.up}/'),
        ("digest-without-axis", '/{motion.up}/{s.joints}', '/{s.joints}'),
    ),
    *of(
        "data/fetching.py", "data/test_fetching.py",
        ("empty-files-are-data", "    if not head:\n", "    if False:\n"),
        ("pointers-are-data", "if head.startswith(POINTER):", "if False:"),
        ("staging-stays", "        shutil.rmtree(folder)\n", "        pass\n"),
    ),
]  # fmt: skip
