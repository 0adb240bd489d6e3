"""What the report page is made from."""
