// What the theme leaves open for readers without a mouse or a screen: parts that scroll are reached by the keyboard, the
// search has a name, and parts of one navigation are no landmarks of their own.
"use strict";

function mend() {
  for (const each of document.querySelectorAll("pre > code, .md-typeset__scrollwrap")) each.tabIndex = 0;
  for (const each of document.querySelectorAll(".md-search")) each.ariaLabel = "Search";
  for (const each of document.querySelectorAll(".md-code__nav, .md-nav .md-nav:not(.md-nav--secondary)")) {
    for (const name of ["aria-label", "aria-labelledby", "aria-expanded"]) each.removeAttribute(name);
    each.role = "presentation";
  }
}

mend();
new MutationObserver(mend).observe(document.body, { childList: true, subtree: true });
