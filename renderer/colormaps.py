def colormap_points(name, count):
    import cmap
    return cmap.Colormap(name).lut(count)[:, :3]
