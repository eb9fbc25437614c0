"""Light that surfaces reflect: SSDO, reflective shadow maps, virtual point lights."""
