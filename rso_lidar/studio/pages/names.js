// Names for screen readers, where elements of NiceGUI and Quasar have none and take none from Python.
function name_elements() {
  // The element around an image has the role and the name.
  for (const image of document.querySelectorAll("[role=img] img:not([alt])")) image.alt = "";
  for (const text of document.querySelectorAll("[aria-label] .cm-content:not([aria-label])")) {
    const editor = text.closest("[aria-label]");
    text.setAttribute("aria-label", editor.getAttribute("aria-label"));
    text.setAttribute("aria-description", "Escape, then Tab, leaves the text.");
    text.tabIndex = 0;
  }
  for (const bar of document.querySelectorAll(".q-loading-bar:not([aria-label])")) bar.setAttribute("aria-label", "Loading");
  for (const inner of document.querySelectorAll("[role=listbox] > [tabindex]")) inner.removeAttribute("tabindex");
  // The input, not the link around it, is what takes the focus and opens the list of files.
  for (const input of document.querySelectorAll(".q-uploader__input:not([aria-label])")) {
    input.setAttribute("aria-label", "Choose files");
    input.tabIndex = 0;
    const link = input.closest("a");
    link.setAttribute("role", "presentation");
    link.removeAttribute("tabindex");
  }
}

// The orange of the editor's light theme has a contrast of 3.5 on white; readable text needs 4.5.
function darken_orange() {
  for (const style of document.head.querySelectorAll("style")) {
    if (style.textContent.includes("#e36209")) style.textContent = style.textContent.replaceAll("#e36209", "#a84300");
  }
}

addEventListener("DOMContentLoaded", () => {
  const below = { childList: true, subtree: true };
  new MutationObserver(name_elements).observe(document.body, below);
  new MutationObserver(darken_orange).observe(document.head, below);
});
