"use strict";

// Elements that the scripts of the pages make, and texts that they write into them.

const elements = {
  /** Makes an element, at the end of `parent` if there is one. */
  make(tag, className, parent, content) {
    const it = document.createElement(tag);
    if (className) it.className = className;
    if (content !== undefined) it.textContent = content;
    parent?.append(it);
    return it;
  },

  /** Writes a text, if another one is there: the same text again would be read aloud again. */
  write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  },
};
