"""Mutants of fetching."""

from tests.mutants.mutant import of

MUTANTS = [
    *of(
        "data/fetching/download.py", "data/fetching/test_download.py",
        ("progress-earns-no-patience", "failed = 0 if size > best else failed + 1", "failed = failed + 1"),
        ("tries-at-an-even-distance", "patience.pause * 2 ** max(failed - 1, 0)", "patience.pause"),
        ("web-pages-are-data", 'if head.startswith(b"<"):', 'if head.startswith(b"<<"):'),
        ("announced-bytes-not-counted", "self.size - self._first != int(announced)", "self.size - self._first > int(announced)"),
    ),
    *of(
        "data/fetching/lists.py", "data/fetching/test_cmu.py",
        ("digest-of-the-skeleton-alone", "motion.positions.astype(np.float64)", "0 * motion.positions.astype(np.float64)"),
        ("any-motion-is-the-listed-one", "if found == clip.motion and not others:", "if not others:"),
    ),
    *of(
        "data/fetching/cmu.py", "data/fetching/test_cmu.py",
        ("a-publisher-without-the-data-asked-on", "== MOST_FAULTS:", "== 4 * MOST_FAULTS:"),
        ("clips-without-their-labels", "    _label(folder, clips)\n            missing", "    missing"),
    ),
    *of(
        "data/fetching/lafan1.py", "data/fetching/test_lafan1.py",
        ("there-is-whole", "return all(pooch.file_hash(", "return any(pooch.file_hash("),
    ),
    *of(
        "data/fetching/unpack.py", "data/fetching/test_unpack.py",
        ("zips-may-leave-their-folder", 'or ".." in path.parts ', ""),
        ("zips-may-hold-links", "kind not in (0, stat.S_IFREG, stat.S_IFDIR)", "kind in (stat.S_IFIFO,)"),
    ),
]  # fmt: skip
