"""Controllers for a mission: machines by racing, networks by evolution, numbers of behaviors by CMA-ES."""
