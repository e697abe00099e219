// What the theme leaves open for readers without a mouse or a screen: parts that scroll are reached by the keyboard, the
// search has a name, and parts of one navigation are no landmarks of their own. A word of code, such as an option, is not
// broken after its hyphens.
"use strict";

// Longer words are broken where a line ends.
const LONGEST_WORD = 26;

function unbroken(word) {
  if (word.length > LONGEST_WORD || !word.includes("-")) return word;
  const span = document.createElement("span");
  span.style.whiteSpace = "nowrap";
  span.textContent = word;
  return span;
}

function mend() {
  for (const each of document.querySelectorAll(".md-content :not(pre) > code")) {
    if (each.childElementCount || !each.textContent.includes("-")) continue;
    const words = each.textContent.split(/(\s+)/).map(unbroken);
    if (words.some((word) => word instanceof Element)) each.replaceChildren(...words);
  }
  for (const each of document.querySelectorAll("pre > code, .md-typeset__scrollwrap")) each.tabIndex = 0;
  for (const each of document.querySelectorAll(".md-search")) each.ariaLabel = "Search";
  for (const each of document.querySelectorAll(".md-code__nav, .md-nav .md-nav:not(.md-nav--secondary)")) {
    for (const name of ["aria-label", "aria-labelledby", "aria-expanded"]) each.removeAttribute(name);
    each.role = "presentation";
  }
}

mend();
new MutationObserver(mend).observe(document.body, { childList: true, subtree: true });
