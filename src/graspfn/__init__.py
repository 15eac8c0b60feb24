"""graspfn: learning a grasp function, after Johns, Leutenegger and Davison (IROS 2016)."""
