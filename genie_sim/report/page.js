// What every page does: a table shows the rows that hold every word of its field.

for (const field of document.querySelectorAll("input[type=search]")) {
  const box = field.closest(".filtered"),
    rows = [...box.querySelectorAll("tbody > tr")];
  const show = () => {
    const asked = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !asked.every((word) => text.includes(word));
    }
    box.querySelector("output").value = `${rows.filter((row) => !row.hidden).length} of ${rows.length}`;
  };
  field.addEventListener("input", show);
  show();
}
