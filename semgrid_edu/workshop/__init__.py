"""The workshop: what makes data, tables, pages and grades. It imports the book; the book never imports it."""
