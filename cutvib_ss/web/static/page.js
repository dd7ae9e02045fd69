// Drops and picks of campaigns: folders keep their paths, which an ordinary upload would lose.
(() => {
  const entriesOf = async (entry, prefix) => {
    if (entry.isFile) {
      const file = await new Promise((done, failed) => entry.file(done, failed));
      return [[prefix + entry.name, file]];
    }
    const reader = entry.createReader();
    const found = [];
    for (;;) {
      const some = await new Promise((done, failed) => reader.readEntries(done, failed));
      if (!some.length) break;
      for (const inner of some) found.push(...(await entriesOf(inner, prefix + entry.name + "/")));
    }
    return found;
  };

  const send = async (zone, files) => {
    if (!files.length) return;
    zone.classList.add("busy");
    const note = zone.querySelector(".drop-note");
    const before = note.textContent;
    note.textContent = `reading ${files.length} file${files.length > 1 ? "s" : ""} …`;
    const form = new FormData();
    for (const [path, file] of files) form.append("files", file, encodeURIComponent(path));
    let answer;
    try {
      const reply = await fetch(zone.dataset.url, { method: "POST", body: form });
      answer = await reply.json();
    } catch (error) {
      answer = { error: "the upload did not arrive; is the server still running?" };
    }
    note.textContent = before;
    zone.classList.remove("busy");
    emitEvent("cutvib_uploaded", answer);
  };

  document.addEventListener("change", (event) => {
    const zone = event.target.closest?.(".drop-zone");
    if (!zone || event.target.type !== "file") return;
    const files = [...event.target.files].map((file) => [file.webkitRelativePath || file.name, file]);
    event.target.value = "";
    send(zone, files);
  });
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    document.querySelector(".drop-zone")?.classList.add("over");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.querySelector(".drop-zone")?.classList.remove("over");
  });
  document.addEventListener("drop", async (event) => {
    event.preventDefault();
    const zone = document.querySelector(".drop-zone");
    if (!zone) return;
    zone.classList.remove("over");
    const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry?.()).filter(Boolean);
    const files = [];
    for (const entry of entries) files.push(...(await entriesOf(entry, "")));
    send(zone, files);
  });
  let width = innerWidth;
  let waiting;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      if (Math.abs(innerWidth - width) < 40) return;
      width = innerWidth;
      emitEvent("cutvib_width", { width });
    }, 300);
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", (event) => {
    emitEvent("cutvib_scheme", { dark: event.matches });
  });
})();
