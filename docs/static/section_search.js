/* Ranking of sections by the words of a search, in place of Sphinx's search of whole pages. The index comes from
   docs/extensions/section_search.py; titles, names of the API, stems and the list of results are Sphinx's. */
"use strict";

const SectionSearch = {
  K1: 1.2, // BM25: how soon further occurrences of a word count less
  B: 0.75, // BM25: how much long sections count less
  TITLE: 2.0, // a title of this one word, over a word of the text
  SYNONYM: 0.6, // a synonym, or a word that only begins like the one typed, over the word itself
  BEST: 100, // score of the best section; Sphinx gives names of the API that match exactly 11 to 26
  BEST_OF_NAME: 10, // the same where a name of the API such as `load_scenario` was typed, which then comes first
  LEAST: 0.2, // share of the best score that a section needs to be listed
  MOST: 30, // sections that are listed

  setIndex: (index) => {
    const total = index.sections.reduce((sum, section) => sum + section[3], 0);
    SectionSearch.index = { ...index, meanLength: total / index.sections.length };
  },

  /* Return the stems to look for, each with its weight: of one word typed, that word and its synonyms. */
  alternatives: (stem) => {
    const { counts, synonyms } = SectionSearch.index;
    const stems = new Map();
    for (const synonym of Object.hasOwn(synonyms, stem) ? synonyms[stem] : []) stems.set(synonym, SectionSearch.SYNONYM);
    if (Object.hasOwn(counts, stem)) stems.set(stem, 1);
    else if (stem.length > 2)
      for (const longer of Object.keys(counts)) if (longer.startsWith(stem)) stems.set(longer, SectionSearch.SYNONYM);
    return stems;
  },

  /* Return the score of each section that has one of the stems. */
  score: (stems) => {
    const { counts, titles, sections, meanLength, ignored } = SectionSearch.index;
    const scores = new Map();
    for (const typed of stems) {
      if (ignored.includes(typed)) continue;
      const best = new Map(); // of the alternatives, the one that fits a section best
      for (const [stem, weight] of SectionSearch.alternatives(typed)) {
        const list = Object.hasOwn(counts, stem) ? counts[stem] : [];
        const rarity = weight * Math.log(1 + (sections.length - list.length / 2 + 0.5) / (list.length / 2 + 0.5));
        const entitled = new Set(Object.hasOwn(titles, stem) ? titles[stem] : []);
        for (let k = 0; k < list.length; k += 2) {
          const [, , , length, titleLength] = sections[list[k]];
          const norm = SectionSearch.K1 * (1 - SectionSearch.B + (SectionSearch.B * length) / meanLength);
          let gain = ((SectionSearch.K1 + 1) * list[k + 1]) / (list[k + 1] + norm);
          if (entitled.has(list[k])) gain += SectionSearch.TITLE / Math.sqrt(titleLength);
          best.set(list[k], Math.max(best.get(list[k]) || 0, rarity * gain));
        }
      }
      for (const [section, gain] of best) scores.set(section, (scores.get(section) || 0) + gain);
    }
    for (const [section, score] of scores) scores.set(section, score * sections[section][5]);
    return scores;
  },

  /* Return results in Sphinx's form: page, title, anchor, description, score, file, kind. */
  search: (searchTerms, excludedTerms) => {
    const stemmer = new Stemmer();
    const words = (name) => name.split("_").filter(Boolean).map((word) => stemmer.stemWord(word));
    const split = (terms) => [...terms].flatMap((term) => (term.includes("_") ? words(term) : [term]));
    const scores = SectionSearch.score(new Set(split(searchTerms)));
    for (const section of SectionSearch.score(new Set(split(excludedTerms))).keys()) scores.delete(section);
    const best = Math.max(...scores.values());
    const top = [...searchTerms].some((term) => term.includes("_")) ? SectionSearch.BEST_OF_NAME : SectionSearch.BEST;
    const ranked = [...scores].sort((a, b) => b[1] - a[1]).slice(0, SectionSearch.MOST);
    const { pages, sections } = SectionSearch.index;
    const files = new Map(Search._index.docnames.map((name, k) => [name, Search._index.filenames[k]]));
    return ranked
      .filter(([, score]) => score > SectionSearch.LEAST * best)
      .map(([section, score]) => {
        const [page, anchor, title] = sections[section];
        const name = pages[page];
        return [name, title, `#${anchor}`, null, (top * score) / best, files.get(name), SearchResultKind.text];
      });
  },
};

Search.performTermsSearch = SectionSearch.search;
