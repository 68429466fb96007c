"""Powers of ten as the C of the log's numbers needs them."""

# Exponents that doubles need, the smallest subnormal number and the largest one included.
SMALLEST, LARGEST = -292, 324
BITS = 128


def powers_of_ten() -> str:
    """C source of a table: 10**k, scaled to 128 bits of which the first is 1, rounded up."""
    rows = []
    for k in range(SMALLEST, LARGEST + 1):
        over, under = (10**k, 1) if k >= 0 else (1, 10**-k)
        # So that over * 2**shift / under has BITS or one more.
        shift = BITS - over.bit_length() + under.bit_length()
        scaled = -((-over << shift) // under) if shift >= 0 else -(-over // (under << -shift))
        while scaled >> BITS:
            shift -= 1
            scaled = -((-over << shift) // under) if shift >= 0 else -(-over // (under << -shift))
        rows.append(f"{{{scaled >> 64:#x}u, {scaled & (2**64 - 1):#x}u}},")
    body = "\n".join(rows)
    return f"#define SMALLEST ({SMALLEST})\nstatic const Power powers[] = {{\n{body}\n}};\n"
