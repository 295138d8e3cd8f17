// What survives a reload: scheme and widths of panels in cookies, and what is selected in the address.
function remember(key, value) {
  document.cookie = `studio_${key}=${value}; path=/; max-age=31536000; samesite=strict`;
}

function show_in_address(key, value) {
  const address = new URL(location);
  if (value) address.searchParams.set(key, value);
  else address.searchParams.delete(key);
  history.replaceState(null, "", address);
}

// Another document: what was selected in the last one is gone.
function show_document_in_address(name) {
  const before = new URL(location).searchParams.get("file");
  if (before !== null && before !== name) for (const key of ["table", "frame", "pixel"]) show_in_address(key, "");
  show_in_address("file", name);
}
