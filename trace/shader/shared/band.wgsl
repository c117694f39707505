// The tiles that a dispatch works on.

#import declarations

@group(0) @binding(1) var<uniform> band: Band;
