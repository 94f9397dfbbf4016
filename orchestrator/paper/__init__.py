"""The paper's numbers and claims beside ours; `report` puts them together."""
