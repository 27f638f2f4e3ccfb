// Where on a page is what a ray hit: hits have the numbers of the whole scene, and a page has some of its instances, and of
// some objects only some grids.

struct Place {
    // Of the instance on the page; NONE where what was hit is on another.
    instance: u32,
    // Of the grid in its object there.
    grid: u32,
}

// The first of `count` words from `first` on, which ascend, that is not below `number`.
fn first_from(first: u32, count: u32, number: u32) -> u32 {
    var from_place = 0u;
    var end = count;
    while from_place < end {
        let middle = (from_place + end) / 2u;
        if words[first + middle] < number {
            from_place = middle + 1u;
        } else {
            end = middle;
        }
    }
    return from_place;
}

// The place of what was hit, which is no miss.
fn place_of(hit: Hit) -> Place {
    if launch.places == NONE {
        return Place(select(NONE, hit.instance, hit.instance < launch.instances), hit.grid);
    }
    // An instance is on a page twice where two parts of its object are.
    var i = first_from(launch.places, launch.instances, hit.instance);
    while i < launch.instances && words[launch.places + i] == hit.instance {
        let instance = words[launch.places + launch.instances + i];
        let object = objects[instances[instance].object];
        if object.numbers == NONE {
            return Place(instance, hit.grid);
        }
        let grid = first_from(object.numbers, object.grid_count, hit.grid);
        if grid < object.grid_count && words[object.numbers + grid] == hit.grid {
            return Place(instance, grid);
        }
        i += 1u;
    }
    return Place(NONE, 0u);
}
