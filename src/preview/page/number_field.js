// Number fields: each explains what it accepts when a number is out of range.

const LARGEST = 1e9;

// Calls `change` with each valid number that is entered in the field; an empty field is 0. Otherwise the range is explained
// in the element `explanation`, until the number is corrected. `name`: what the number is.
export function numberField(field, explanation, { name, isWhole = false, change }) {
  const explain = (text) => {
    // Another field's stays until its own number is corrected.
    if (text || explanation.dataset.field === field.id) {
      explanation.hidden = !text;
      explanation.textContent = text;
      explanation.dataset.field = field.id;
    }
    field.toggleAttribute("aria-invalid", Boolean(text));
    if (text) field.setAttribute("aria-invalid", "true");
  };
  field.setAttribute("aria-describedby", explanation.id);
  field.addEventListener("change", () => {
    const text = field.value.trim();
    // In a whole number a comma or a dot may separate thousands, or be a mistake.
    const value = isWhole && /[.,]/.test(text) ? NaN : Number(text.replace(",", "."));
    const isInRange = value >= 0 && value <= LARGEST && !(isWhole && !Number.isInteger(value));
    explain(isInRange ? "" : `${name}: ${field.value} was not accepted; enter a ${isWhole ? "whole " : ""}number from 0 to 10⁹`);
    if (isInRange) change(value);
  });
  // Escape takes the render's own number back.
  field.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    explain("");
    field.value = field.dataset.value ?? "";
    field.blur();
    event.stopPropagation();
  });
}

// Shows a value in a field, unless the user is editing it or has to correct it.
export function fillField(field, value) {
  const isWhole = Number.isInteger(value);
  const text = value === null || value === undefined ? "" : String(isWhole ? value : Number(value.toPrecision(6)));
  field.dataset.value = text;
  if (document.activeElement === field || field.hasAttribute("aria-invalid")) return;
  if (field.value !== text) field.value = text;
}
