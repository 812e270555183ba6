def page() -> str:
    return "# keys\n"
