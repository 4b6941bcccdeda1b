"""The report of Bendat, Palo and Coppolino (1990) run again: cases, tables, figures and claims."""
