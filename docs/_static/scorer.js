// Order of what a search finds: a name of the library that was typed whole, chapters and how-tos, other texts, the rest of the library.
var Scorer = {
  objNameMatch: 11, objPartialMatch: 6, objPrio: {0: 15, 1: 5, 2: -5}, objPrioDefault: 0,
  title: 15, partialTitle: 7, term: 5, partialTerm: 2,
  score: ([page, title, anchor, , score, , kind]) => {
    const asked = (new URLSearchParams(location.search).get("q") || "").trim().toLowerCase(), name = title.toLowerCase();
    if (kind === "object" && (name === asked || (name.endsWith("." + asked) && !anchor.startsWith("#module-")))) return score + 1000;
    return score + ({notebooks: 200, howto: 200, api: -200}[page.split("/")[0]] || 0);
  },
};
// Opened as a file, a page may not read others: results then come without excerpts.
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
