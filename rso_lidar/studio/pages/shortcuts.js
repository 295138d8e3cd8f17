// Keys of the studio: Ctrl-S saves; Ctrl-Z, Ctrl-Shift-Z and Ctrl-Y undo and redo, but where a text is typed, which has its own.
addEventListener("keydown", (event) => {
  if (!event.ctrlKey || event.repeat) return;
  const key = event.key.toLowerCase();
  const is_typed = event.target.closest?.("input, textarea, [contenteditable]");
  let name;
  if (key === "s") name = "save";
  else if (is_typed) return;
  else if (key === "z") name = event.shiftKey ? "redo" : "undo";
  else if (key === "y") name = "redo";
  if (!name) return;
  event.preventDefault();
  document.querySelector(`[data-test=${name}]`)?.click();
});
