// Sentences as people type them, put into the words of the grammar: `as_learnt` of mwlib/synthetic/sentences_typed.py, whose
// tables come with the model. A sentence becomes words, and each word knows where it was typed.

const WORD = /[\p{L}\p{N}_]+(?:'[\p{L}\p{N}_]+)*/gu;
export const wordsOf = (text) => text.toLowerCase().replaceAll("’", "'").match(WORD) ?? [];

export class Reader {
  constructor(tables) {
    Object.assign(this, tables);
    this.known = new Set(tables.words);
    this.nouns = new Set(Object.values(tables.persons).map((said) => said.split(" ").at(-1)));
    this.patterns = tables.phrases.map(([typed, said, unless]) => [new RegExp(typed, "g"), said.replaceAll("\\", "$"), unless]);
    this.spoken = new Set([...Object.keys(tables.forms), ...Object.values(tables.forms)]);
  }
  form(word) {
    return Object.hasOwn(this.forms, word) ? this.forms[word] : undefined;
  }
  /** The sentence in the words of the grammar, and the actions that it asks for; throws what the model cannot do. */
  read(sentence) {
    const foreign = [...sentence].find((letter) => /\p{L}/u.test(letter) && !/\p{Script=Latin}/u.test(letter));
    if (foreign) throw new Error(`“${foreign}” is of another script: the model has learnt English`);
    let text = wordsOf(sentence).join(" ").replace(new RegExp(this.still, "g"), "does not move");
    const denial = text.replaceAll("does not move", "").split(" ").find((word) => this.denials.includes(word) || word.endsWith("n't"));
    if (denial) throw new Error(`“${denial}” says what is not done: the model has learnt no denial`);
    for (const [typed, said] of Object.entries(this.synonyms)) text = text.replace(new RegExp(`(?<!\\S)${typed}(?!\\S)`, "g"), said);
    text = this.verbs(this.somebody(text.split(/\s+/).filter(Boolean))).join(" ");
    for (const [typed, said, unless] of this.patterns) if (!unless || !text.includes(unless)) text = text.replace(typed, said);
    const actions = this.actions(text);
    if (actions.length > this.most) throw new Error(`this asks for ${actions.join(", ")}: the model can do ${this.most} actions`);
    return { text, actions, isLearnt: actions.length === 1 || this.pairs.some((pair) => `${pair}` === `${actions}`) };
  }
  somebody(words) { // a person of the grammar in front, and no pronoun further on
    const start = this.articles.includes(words[0]) ? 1 : 0;
    if (Object.hasOwn(this.persons, words[start] ?? "")) {
      const named = words.slice(0, start + 1).join(" "), who = named === "the person" ? named : this.persons[words[start]];
      words = [...who.split(" "), ...words.slice(start + 1)];
    } else if (!start && words.slice(0, 2).some((word) => this.spoken.has(word))) words = ["a", "person", ...words];
    return words.filter((word, i) => !(this.joined.includes(words[i - 1]) && this.pronouns.includes(word)));
  }
  verbs(words) { // as the grammar has them: "walks" and "is walking", but "kicks" for "is kicking"
    const found = [];
    words.forEach((word, place) => {
      const before = found.at(-1) ?? "", said = this.form(word);
      if (this.being.includes(word) && words.slice(place + 1, place + 3).some((next) => next.endsWith("ing"))) word = "is";
      else if (said && word.endsWith("ing")) {
        const helped = [1, 2].find((back) => found.at(-back) === "is" && found.length >= back) ?? 0;
        if (!(this.known.has(word) && (helped || before === "remains"))) {
          word = said;
          if (helped) found.splice(-helped, 1);
        }
      } else if (said && !this.articles.includes(before) && (!this.known.has(word) || this.mayBegin(before))) word = said;
      found.push(word);
    });
    return found;
  }
  mayBegin(before) {
    return ["", "first", ...this.joined].includes(before) || this.nouns.has(before) || before.endsWith("ly");
  }
  actions(text) {
    const named = text.replaceAll("stands up", "rises").split(" ").map((word) => (Object.hasOwn(this.named, word) ? this.named[word] : ""));
    return named.filter(Boolean).filter((action, i, all) => action !== all[i - 1]);
  }
  /** What a sentence in the grammar's words says of the motion: `claims` of mwlib. */
  claims(text) {
    const found = {}, clauses = [];
    for (const clause of text.split(new RegExp(this.then)))
      if (this.actions(clause).length || !clauses.length) clauses.push(clause);
      else clauses.push(`${clauses.pop()} ${clause}`); // "sits down, then up": one action
    const asked = clauses.map((clause) => {
      const actions = this.actions(clause);
      return ["walk", "run"].includes(actions[0]) ? this.actions(clause.replaceAll(new RegExp(this.bend, "g"), "")) : actions;
    });
    const both = asked.flat().slice(0, this.most);
    both.forEach((action, i) => (found[["action", "then"][i]] = action));
    clauses.forEach((clause, i) => asked[i].length === 1 && Object.assign(found, this.manner(asked[i][0], clause)));
    if (both.length === this.most) // whose number it is, nobody knows where both have one
      for (const name of Object.keys(found)) if (both.every((action) => name in this.recipes[action])) delete found[name];
    return found;
  }
  manner(action, clause) {
    const words = clause.split(" "), told = {};
    for (const [kind, rows] of Object.entries(this.values)) {
      const said = Object.entries(rows).filter(([, known]) => known.split(" ").some((word) => words.includes(word)));
      told[kind] = said.length === 1 ? said[0][0] : "";
    }
    const way = new RegExp(this.bend).test(clause) ? "turn" : told.round;
    Object.assign(told, { path: way ? `${told.side}_${way}` : told.ahead, pace: told.speed, hand: told.side, foot: told.side, turn: told.side });
    const can = this.recipes[action === "walk" && told.direction === "backward" ? "backward" : action];
    const fits = ([name, value]) => value && (can[name] ?? "").split(" ").includes(value);
    return Object.fromEntries(Object.entries(told).filter(fits).map(([name, value]) => [name, /^\d+$/.test(value) ? +value : value]));
  }
  /** How long people take for it, seconds; undefined where the model has not learnt the actions. */
  time(text) {
    const said = this.claims(text), action = said.direction === "backward" ? "backward" : said.action;
    if (said.then) return this.times[`${said.action} then ${said.then}`];
    return this.times[[action, ...this.timed.map((name) => said[name]).filter(Boolean)].join(" ")];
  }
}

/** Numbers of the start and of the words, as the text encoder has learnt them; 2 is the one of all unknown words. */
export function numbersOf(text, vocabulary, longest = 76) {
  const number = new Map(vocabulary.map((word, i) => [word, i + 3]));
  return [1, ...wordsOf(text).slice(0, longest).map((word) => number.get(word) ?? 2)];
}
