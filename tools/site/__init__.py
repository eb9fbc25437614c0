"""The documentation site, as far as it is made from the code: pages of public names, links, pages of other folders."""
