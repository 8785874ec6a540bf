// Single rays through the P-k-d tree, a thread each. Twin of structure/pkd.rs.

fn search(ray: Ray, except: u32, any: bool) -> Met {
    let met = Met(ray.t_max, NONE);
    if outline.particles == 0u {
        return met;
    }
    return search_heap(ray, inv_direction(ray.direction), heap_of(0u), met, except, any);
}
